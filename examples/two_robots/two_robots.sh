#!/usr/bin/env bash
# Two missions in one simulated world: two_robots.sh [SPEED], in simulated seconds per second.
# The exit status is 0 if both missions are complete. Ctrl-C ends everything.

speed=${1:-5}
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
PATH=$PATH:$here/../../.venv/bin
# A simulation is of no interest to other machines.
export ROS_AUTOMATIC_DISCOVERY_RANGE=${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}

command -v sar-run > /dev/null || { echo "two_robots.sh: there is no sar-run; run 'make env' first" >&2; exit 2; }

summaries=$(mktemp -d)
end() {
    # A second Ctrl-C must not cut this short.
    trap '' INT TERM
    kill $(jobs -p) 2>/dev/null
    wait
    for summary in "$summaries"/*; do
        [ -s "$summary" ] && printf '\n%s: ' "${summary##*/}" && cat "$summary"
    done
    rm -r "$summaries"
}
trap end EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

# The simulator moves each robot into its namespace itself.
sar-sim run --speed "$speed" --robot robot1:0,0.7,1.57 --robot robot2:0,-0.7,-1.57 &
simulator=$!

missions=()
for robot in robot1 robot2; do
    ros=(--ros-args -r "__ns:=/$robot" -r /tf:=tf -r /tf_static:=tf_static -p use_sim_time:=true)
    sar-detect-survivor-server "${ros[@]}" &
    sar-report-survivor-server "${ros[@]}" &
    sar-run --until complete --params "$here/$robot.yaml" "${ros[@]}" > "$summaries/$robot" &
    missions+=($!)
done

status=0
for mission in "${missions[@]}"; do
    wait -n "$mission" "$simulator" || status=1
    # Without a world there is nothing to wait for.
    kill -0 "$simulator" 2>/dev/null || exit 1
done
exit $status
