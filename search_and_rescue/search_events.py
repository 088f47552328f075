"""The kinds of events that the mission records. `docs/reference/journal.md` describes the data of each kind."""

ZONE_STARTED, ZONE_SEARCHED, SURVIVOR_UNPLACED = "zone_started", "zone_searched", "survivor_unplaced"
ZONE_CHOSEN, ZONE_VISITED = "zone_chosen", "zone_visited"
ZONE_POSTPONED, ZONE_ABANDONED = "zone_postponed", "zone_abandoned"
SWEEP_PLANNED, PIECE_SWEPT, PIECE_SKIPPED = "sweep_planned", "piece_swept", "piece_skipped"
SURVIVOR_NAMED = "survivor_named"
REPORT_SENT, REPORT_KEPT, REPORT_ACKNOWLEDGED = "report_sent", "report_kept", "report_acknowledged"
BASE_REACHED, CHARGING_REACHED = "base_reached", "charging_reached"
HOME_FIRST, CHARGED, ALARMED = "home_first", "charged", "alarmed"

# Kinds that only commands record; the command `skip_zone` records ZONE_ABANDONED.
COMMAND_GIVEN, ZONE_ADDED, AREA_DRAWN = "command_given", "zone_added", "area_drawn"
HINT_GIVEN, SURVIVOR_JUDGED = "hint_given", "survivor_judged"
