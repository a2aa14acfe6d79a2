#!/bin/sh
# Checks the Vulkan device of this machine and measures it: run.sh OUT, at most eight minutes. README.md says how to read OUT.
#
#   run.sh OUT                 HEDGEROW_DEVICE=NAME run.sh OUT     the device so called
#   HEDGEROW_SECONDS=N         seconds for all of it (480)
set -u

[ $# = 1 ] || { echo "usage: run.sh OUT (the folder for records)" >&2; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$1" || exit 1
out=$(cd "$1" && pwd)
# What the program keeps between runs: nowhere but there.
export HEDGEROW_CACHE="$out/cache"
unset HEDGEROW_SCENES
seconds=${HEDGEROW_SECONDS:-480}
begin=$(date +%s)
left=
failed=

say() { echo "$*" | tee -a "$out/summary.txt"; }
remaining() { echo $((seconds - ($(date +%s) - begin) - 5)); }

# step NAME LEAST MOST COMMAND…: at most MOST seconds, and none if fewer than LEAST remain. Its words go to OUT/NAME.txt.
step() {
    name=$1 least=$2 most=$3
    shift 3
    room=$(remaining)
    if [ "$room" -lt "$least" ]; then
        left="$left $name"
        say "$name: left out, $room s remain and it needs $least"
        return 0
    fi
    [ "$room" -lt "$most" ] && most=$room
    from=$(date +%s)
    timeout --kill-after 5 "$most" "$@" > "$out/$name.txt" 2>&1 < /dev/null
    status=$?
    took=$(($(date +%s) - from))
    case $status in
        0) say "$name: done in $took s" ;;
        124 | 137)
            left="$left $name"
            say "$name: ended after $took s, before it was done; what it had measured is kept"
            ;;
        *)
            failed="$failed $name"
            say "$name: failed with status $status after $took s: $(tail -n 1 "$out/$name.txt")"
            ;;
    esac
}

: > "$out/summary.txt"
say "hedgerow $(cat "$here/COMMIT"), $(uname -sm), $(date -u +%Y-%m-%dT%H:%M:%SZ)"
if ! "$here/hedgerow" devices > "$out/devices.txt" 2>&1; then
    cat "$out/devices.txt"
    say "There is no such Vulkan device here. The loader reads VK_DRIVER_FILES, or the files in /usr/share/vulkan/icd.d and /etc/vulkan/icd.d:"
    ls /usr/share/vulkan/icd.d /etc/vulkan/icd.d 2> /dev/null | sed 's/^/  /' | tee -a "$out/summary.txt"
    exit 1
fi
cat "$out/devices.txt"
if ! grep -q '^ *\*.*nothing *$' "$out/devices.txt"; then
    say "The device marked * lacks what hedgerow needs; see the table. Another one is chosen by HEDGEROW_DEVICE."
    exit 1
fi

cd "$out" || exit 1
hedgerow=$here/hedgerow
set -- "$here"/scenes/*.zst "$here"/scenes/*.ply "$here"/scenes/*.glb "$here"/scenes/*.obj "$here"/scenes/*.tri
scenes=
for file in "$@"; do
    case $file in
        *_parts.*) ;;
        *) [ ! -f "$file" ] || scenes="$scenes
$(wc -c < "$file") $file" ;;
    esac
done
# Small ones first: what the time ends before is large.
scenes=$(echo "$scenes" | sed '/^$/d' | sort -n | cut -d' ' -f2-)

step check 20 140 "$hedgerow" check --quick --limit 90 --json "$out/check.json"
# Ten million triangles: LBVH and its sort beside a plain copy of the bytes that they must move.
step ten-million 30 90 "$hedgerow" build gen:soup:10000000:1 -b lbvh:collapse=off --runs 5 --epo off --json "$out/ten-million.jsonl"
# One builder at a time: what it has measured is written when it ends.
for builder in lbvh hploc hploc:width=8q hlbvh ploc; do
    name=million-$(echo "$builder" | tr ':=' '--')
    step "$name" 10 40 "$hedgerow" build gen:soup:1000000:1 -b "$builder" --runs 5 --epo off --json "$out/$name.jsonl"
done
# Where the time of builds goes, dispatch by dispatch.
step kernels 10 40 "$hedgerow" build "$here/scenes/knot.ply" -b lbvh,hploc,hploc:width=8q:optimise=0.5 --runs 9 --epo off --by-kernel \
    --json "$out/kernels.jsonl"
old=$IFS
IFS='
'
# shellcheck disable=SC2086 -- one word a line
set -- $scenes
IFS=$old
step kd-trees 20 60 "$hedgerow" --threads 2 bench "$here/scenes/knot.ply" gen:soup:200000:1 -b kd-gpu,kd-binned --runs 3 \
    --rays primary,ao,diffuse1 --epo off --no-pictures -o "$out/kd-trees"
step accel 20 70 "$hedgerow" accel --runs 3 --structures 1024 --instances 10000 --size 80x60 --frames 7 -o "$out/accel"
step bench 20 150 "$hedgerow" bench "$@" -b lbvh,hploc,lbvh:width=8q,driver-fast-build,driver-fast-trace --runs 3 --epo off \
    --no-pictures -o "$out/bench"
step million-hosts 20 60 "$hedgerow" bench gen:soup:1000000:2 -b lbvh,hploc,driver-fast-trace --runs 3 --rays primary,random --epo off \
    --no-pictures -o "$out/bench-million"

# One page of whatever was measured: results.jsonl and accel.jsonl are written line by line.
set --
for folder in bench bench-million kd-trees accel; do
    for file in results.jsonl accel.jsonl; do
        if [ -s "$out/$folder/$file" ]; then set -- "$@" "$out/$folder"; fi
    done
done
[ $# = 0 ] || step report 0 20 "$hedgerow" report "$@" -o "$out/report"

say "left out:${left:- nothing}"
say "failed:${failed:- nothing}"
[ -f "$out/report/index.html" ] && say "page: $out/report/index.html"
tail -n 1 "$out/check.txt" 2> /dev/null
[ -z "$failed" ]
