MESSAGE = "this module is broken on purpose"
raise RuntimeError(MESSAGE)
