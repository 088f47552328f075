"""Random trees that count, compare and copy, so that some values make no difference; and properties."""

import random
import re

# The keys of each kind: those for numbers, those for any value, and those of a subtree.
_NUMBERS = ("n", "m", "r")
_STEPS = (
    "{x} += 1",
    "{x} = 1 + {x}",
    "{x} = {x} == 2 ? {x} : {x} + 1",
    "{x} = 0",
    "{x} := {y} + 1; {y} := 0",
    "{x} -= 1",
    "{x} = {x} > 2 ? 0 : {x} + 2",
    "{x} := {y}",
    "{x} = {x} - 2",
    "{x} += 0.5",
    "{x} := {y} - 1",
    "{x} := 2; {x} += 1",
    "{x} = {x} < 3",
    "{x} := 'text'",
    "{t} := 'round ' .. {x}",
    "{t} := {x} / 2",
    "{t} := {x}",
    "{x} *= 2",
    "{x} = true",
    "{x} = !{y}",
    "{x} = {x} + {y}",
    "{x} = {x} ? {x} - 1 : 3",
    "{x} := LOW",
    "{x} = {x} == LOW ? HIGH : {x} + 1",
    "{t} := {y} := 1",
    "{x} + 1",
    "{x} = {y} = 3",
)
# Steps that mix types.
_TYPED = (
    "{x} := {y}",
    "{x} := 0.5",
    "{x} = 0",
    "{x} := 2.0",
    "{x} += 1",
    "{x} += 0.5",
    "{x} = {y} + 1",
    "{t} := {x}",
    "{t} = {x} / 2",
    "{t} := 'round ' .. {x}",
    "{x} = true",
    "{x} = {x} - 0.5",
)
_CONDITIONS = (
    "{x} < 3",
    "{x} >= 2",
    "1 < {x} <= 3",
    "{x} == 2",
    "{x} != 1 && {y} < 2",
    "{x} + 1 > 3",
    "2.5 > {x}",
    "!{x}",
    "{x}",
    "{x} == {y}",
    "{x} && {y} < 2",
    "{x} > 2 ? true : {y} <= 0",
    "{x} < HIGH",
    "{x} == 'LOW'",
    "-1 >= {x}",
    "{x} + {y} > 3",
    "({x} := 1) == 1",
    "{t} != 'round 1'",
)
_LEAVES = ("<X/>", "<Y/>", "<Z/>", "<P/>", "<A/>")
_OTHERS = (
    '<SetBlackboard value="1" output_key="{x}"/>',
    '<SetBlackboard value="{{y}}" output_key="{t}"/>',
    '<Sequence><UnsetBlackboard key="{x}"/><Script code="{x} := 0.5"/></Sequence>',
    '<Sequence><UnsetBlackboard key="{x}"/><Script code="{x} := 1"/></Sequence>',
    '<UnsetBlackboard key="{t}"/>',
    '<Repeat num_cycles="{{x}}"><X/></Repeat>',
    '<Switch2 variable="{{x}}" case_1="1" case_2="2"><X/><Y/><Z/></Switch2>',
    '<SubTree ID="Inner" k="{{x}}" l="{{t}}"/>',
    '<SubTree ID="Inner" k="{{x}}" _autoremap="true"/>',
    '<WasEntryUpdated entry="{{x}}"/>',
    '<SkipUnlessUpdated entry="{x}"><X/></SkipUnlessUpdated>',
    '<LoopInt queue="1;2;3" value="{{x}}"><Y/></LoopInt>',
)
_CONTROLS = {
    "Sequence": 3,
    "Fallback": 2,
    "ReactiveSequence": 3,
    "ReactiveFallback": 2,
    "SequenceWithMemory": 2,
    "AsyncSequence": 2,
    'Parallel success_count="2" failure_count="1"': 2,
    'Parallel success_count="1" failure_count="2"': 2,
    "ParallelAll": 2,
    "IfThenElse": 3,
    "WhileDoElse": 3,
}
_DECORATORS = (
    "Inverter",
    "ForceSuccess",
    "KeepRunningUntilFailure",
    'RetryUntilSuccessful num_attempts="2"',
    'RetryUntilSuccessful num_attempts="-1"',
    'Repeat num_cycles="2"',
    "RunOnce",
    'Timeout msec="100"',
    'Delay delay_msec="10"',
    "SuccessIsRunning",
)
_EXTRAS = ("_skipIf", "_failureIf", "_successIf", "_while")
_AFTERWARDS = ("_onSuccess", "_onFailure", "_onHalted", "_post")
_STARTS = (
    "n := 0; m := 0; r := 0",
    "n := 0; m := 0.0; r := 1; t := ''",
    "n := 0.5; m := 0; r := 0; t := 0",
    "n := 0; m := true",
    "n := 0; m := n; r := 2; t := 0.0",
)
ENUMS = {"LOW": 1, "HIGH": 4}


class RandomCounters:
    """A random tree.

    Args:
        seed: The seed.
    """

    def __init__(self, seed: int) -> None:
        self._chance = random.Random(seed)  # noqa: S311 - the same in every run
        # With few kinds of steps there are keys whose values make no difference.
        plain = self._chance.random() < 0.6
        steps, conditions = (_STEPS[:8], _CONDITIONS[:7]) if plain else (_STEPS, _CONDITIONS)
        self._steps = self._chance.sample(steps, self._chance.choice((1, 2, 3, 5)))
        self._conditions = self._chance.sample(conditions, self._chance.choice((1, 1, 2, 4)))
        self._has_others = self._chance.random() < 0.35
        self._starts = _STARTS[:1] if steps == _STEPS[:8] else _STARTS

    def trees(self) -> str:
        """Return the elements of the file's trees; the first one is the main tree."""
        start = f'<Script code="{self._escaped(self._chance.choice(self._starts))}" oneshot="ON_COMPLETION"/>'
        body = f"<Sequence>{start}{self._node(self._chance.randint(1, 3))}{self._script()}</Sequence>"
        around = self._chance.choice(("{}", "<KeepRunningUntilFailure>{}</KeepRunningUntilFailure>"))
        inner = self._filled(
            '<Sequence><Script code="k = k + 1; l := k"/><ScriptCondition code="k &lt; 4"/></Sequence>'
        )
        tree = f'<BehaviorTree ID="Main">{around.format(body)}</BehaviorTree>'
        return tree + f'<BehaviorTree ID="Inner">{inner}</BehaviorTree>' * ("Inner" in tree)

    def properties(self, tree: str) -> str:
        """Return the text of a properties file about such a tree."""
        chance, leaves = self._chance, sorted(set(re.findall("<([XYZPA])", tree)))
        events = [f"{leaf} {deed}" for leaf in leaves for deed in ("SUCCESS", "FAILURE", "starts")]
        lines = ["  last: {at_end: root == 'SUCCESS'}"]
        for number in range(2 * bool(events)):
            condition = self._filled(chance.choice(("{x} < 2", "{x} >= 3", "{x} == 1")))
            lines += [
                f"  a{number}: {{never: {chance.choice(events)}, while: {condition}}}",
                f"  b{number}: {{after: {chance.choice(events)}, eventually: {chance.choice(events)}}}",
                f"  c{number}: {{at_most_once: {chance.choice(events)}, per: {chance.choice(events)}}}",
            ]
        if chance.random() < 0.3:
            lines.append(f"  end: {{at_end: {self._filled('{x} < 3')}}}")
        return "\n".join(["properties:", *chance.sample(lines, chance.randint(1, len(lines)))])

    def _node(self, depth: int) -> str:
        chance = self._chance
        extra = ""
        if chance.random() < 0.25:
            is_before = chance.random() < 0.5
            attribute = chance.choice(_EXTRAS if is_before else _AFTERWARDS)
            extra = f' {attribute}="{self._escaped(chance.choice(self._conditions if is_before else self._steps))}"'
        kind = chance.random()
        if depth == 0 or kind < 0.3:
            return self._leaf().replace("/>", f"{extra}/>", 1)
        if kind < 0.55:
            tag = chance.choice(_DECORATORS)
            return f"<{tag}{extra}>{self._node(depth - 1)}</{tag.split()[0]}>"
        tag = chance.choice(list(_CONTROLS))
        inside = "".join(self._node(depth - 1) for _ in range(_CONTROLS[tag]))
        return f"<{tag}{extra}>{inside}</{tag.split()[0]}>"

    def _leaf(self) -> str:
        kind = self._chance.random()
        if kind < 0.4:
            return self._chance.choice(_LEAVES)
        if kind < 0.75:
            return self._script()
        if self._has_others and kind < 0.85:
            return self._filled(self._chance.choice(_OTHERS))
        return f'<ScriptCondition code="{self._escaped(self._chance.choice(self._conditions))}"/>'

    def _script(self) -> str:
        return f'<Script code="{self._escaped(self._chance.choice(self._steps))}"/>'

    def _escaped(self, script: str) -> str:
        return self._filled(script).replace("&", "&amp;").replace("<", "&lt;")

    def _filled(self, text: str) -> str:
        x, y = self._chance.sample(_NUMBERS, 2)
        return text.format(x=x, y=y, t="t") if "{" in text else text
