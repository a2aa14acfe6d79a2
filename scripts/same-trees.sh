#!/usr/bin/env bash
# Compares the trees that two copies of the program build, byte for byte: scripts/same-trees.sh OLD NEW [SCENE …]
#
# Every builder with each of its options, one at a time, by the tunings of CPUs and of GPUs. Scenes are those of scenes/, or
# what is named. Exit status 1 if any differs. HEDGEROW_SCENES names a folder of more scenes, TUNINGS which tunings to take.
set -euo pipefail
[ $# -ge 2 ] || { echo "usage: scripts/same-trees.sh OLD NEW [SCENE …]" >&2; exit 2; }
old=$1 new=$2
shift 2
[ $# -gt 0 ] || set -- $(cd "$(dirname "$0")/../scenes" && ls | grep -E '\.(obj|ply|glb|gltf|tri|anim|inst)(\.zst)?$' | sed 's/\..*//' | sort -u)

specs=(lbvh hlbvh ploc:radius=25 hploc kd-gpu lbvh-host ploc-host sweep kd-exact kd-binned)
for codes in mc30 mc63 emc64sort emc64var emc64var-size4 emc64var-extents emc64var-nosize mip9 bin4a4 bin4a4~2048 emc64var+concise emc64var+robust mc63/40; do
  specs+=("lbvh:codes=$codes")
done
for builder in lbvh hlbvh ploc hploc; do
  for option in collapse=off width=4 width=8 width=8q split=0.3 optimise=fast schedule=chain schedule=persistent; do
    specs+=("$builder:$option")
  done
done
specs+=(hploc:window=32 kd-gpu:schedule=chain kd-gpu:schedule=persistent kd-gpu:bins=32 kd-gpu:exact=16)

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
same=0 different=0 refused=0
for scene in "$@"; do
  for tuning in ${TUNINGS:-cpu gpu}; do
    for spec in "${specs[@]}"; do
      built=yes
      for which in old new; do
        "${!which}" --quiet --tuning "$tuning" build "$scene" -b "$spec" --runs 1 --epo off -o "$folder/$which" \
          >"$folder/log-$which" 2>&1 || built=no
      done
      if [ $built = no ]; then
        refused=$((refused + 1))
        echo "refused: $scene $spec $tuning: $(tail -n 1 "$folder/log-new")"
      elif cmp -s "$folder/old" "$folder/new"; then
        same=$((same + 1))
      else
        different=$((different + 1))
        echo "different: $scene $spec $tuning"
      fi
    done
  done
done
echo "$same the same, $different different, $refused refused"
[ $different = 0 ] && [ $same -gt 0 ]
