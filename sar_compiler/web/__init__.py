"""The page of a run, in a browser: live, or of what a journal has.

A page is fed entries, as `Journal.listen` and `JournalFile.stream` have them; what they come to is found out in the browser
(`static/run.js`), by the same code for both. Nothing here imports ROS or knows a mission.
"""
