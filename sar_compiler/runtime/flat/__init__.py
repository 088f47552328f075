"""The flat form of a compiled tree: it ticks the same leaves without generators, and its state can be copied.

`flatten` makes a `FlatTree`, whose cells are all that it remembers between two ticks, but for the blackboard and for
what leaves keep to themselves.
"""
