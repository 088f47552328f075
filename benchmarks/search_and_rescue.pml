/* trees/search_and_rescue.xml by hand, for SPIN: what `sar-compile verify` goes through when it forgets nothing.
 *
 * A state is the status of every node and the facts; a step is a tick, with one of the combinations of answers that
 * the leaves say they can give. Every node ends as py_trees has it: a Sequence that starts again resets its children,
 * a Selector that comes back to an earlier child halts the later ones.
 *
 *     spin -a -DZONES=2000 search_and_rescue.pml && gcc -O2 -o pan pan.c && ./pan -m1000000
 */
#ifndef ZONES
#define ZONES 4
#endif

mtype = { INVALID, RUNNING, SUCCESS, FAILURE, NOWHERE, ZONE, BASE };

mtype root = INVALID, patrol = INVALID, remaining = INVALID, drive = INVALID, detect = INVALID, handle = INVALID,
      found_sequence = INVALID, is_detected = INVALID, broadcast = INVALID, notify = INVALID, log_none = INVALID,
      advance = INVALID, once = INVALID, home = INVALID, final = INVALID, at = NOWHERE;
short zones_left = ZONES;
bool found, named;

inline reset_found() { is_detected = INVALID; broadcast = INVALID; notify = INVALID }
inline reset_patrol() {
	remaining = INVALID; drive = INVALID; detect = INVALID; handle = INVALID; found_sequence = INVALID;
	log_none = INVALID; advance = INVALID; reset_found()
}

active proctype tick() {
again:
	atomic {
		if
		:: patrol == RUNNING && drive == RUNNING -> goto driving
		:: patrol == RUNNING && detect == RUNNING -> goto detecting
		:: patrol == RUNNING && notify == RUNNING -> goto reporting
		:: else -> reset_patrol()
		fi;
		if
		:: zones_left > 0 -> remaining = SUCCESS
		:: else -> remaining = FAILURE; patrol = FAILURE; goto way_home
		fi;
driving:
		if
		:: drive = SUCCESS; at = ZONE
		:: drive = FAILURE; patrol = FAILURE; goto way_home
		:: drive = RUNNING; at = NOWHERE; patrol = RUNNING; goto on_patrol
		fi;
detecting:
		named = false;
		if
		:: detect = SUCCESS; found = true
		:: detect = SUCCESS; found = false
		:: detect = FAILURE; found = false; patrol = FAILURE; goto way_home
		:: detect = RUNNING; found = false; patrol = RUNNING; goto on_patrol
		fi;
		if
		:: found -> is_detected = SUCCESS; broadcast = SUCCESS; named = true
		:: else -> is_detected = FAILURE; found_sequence = FAILURE; goto nobody
		fi;
reporting:
		if
		:: notify = SUCCESS; found_sequence = SUCCESS; handle = SUCCESS; goto advancing
		:: notify = FAILURE; found_sequence = FAILURE
		:: notify = RUNNING; found_sequence = RUNNING; handle = RUNNING; patrol = RUNNING; goto on_patrol
		fi;
nobody:
		log_none = SUCCESS; handle = SUCCESS;
advancing:
		advance = SUCCESS; zones_left--; patrol = SUCCESS;
on_patrol:
		if
		:: root == RUNNING && once == RUNNING -> once = INVALID; home = INVALID
		:: else
		fi;
		root = patrol;
		goto done;
way_home:
		if
		:: final != INVALID -> once = final
		:: else ->
			if
			:: home = SUCCESS; at = BASE; final = SUCCESS
			:: home = FAILURE; final = FAILURE
			:: home = RUNNING; at = NOWHERE
			fi;
			once = home
		fi;
		root = once;
done:
		skip
	}
	goto again
}
