#!/usr/bin/env bash
# Bakes meshes of a .blend into point caches on a Slurm cluster: an array of tasks, a chunk of frames each, and a job
# that verifies the whole when all of them are done.
#
#   slurm.sh FILE.blend FOLDER A-B[:STEP] FRAMES_PER_TASK [options of sinew bake]
#
# FILE.blend and FOLDER are where all nodes see them. BLENDER=/path/to/blender picks the program, and sbatch's own
# variables the partition, the account and so on (SBATCH_PARTITION, ...). Prints the numbers of the two jobs.
set -euo pipefail

usage() {
  sed -n '2,/^set/s/^# \{0,1\}//p' "$0" >&2
  exit 2
}

[ $# -ge 4 ] && [[ $4 =~ ^[1-9][0-9]*$ ]] || usage
# The shell would take a number that begins with 0 for an octal one.
[[ $3 =~ ^(-?)0*([0-9]+)-(-?)0*([0-9]+)(:0*([1-9][0-9]*))?$ ]] || usage
first=${BASH_REMATCH[1]}${BASH_REMATCH[2]} last=${BASH_REMATCH[3]}${BASH_REMATCH[4]} step=${BASH_REMATCH[6]:-1}
length=$(($4 * step)) # of a chunk, in the scene's frames
[ "$first" -le "$last" ] || { echo "the last frame ($last) comes before the first ($first)" >&2; exit 2; }

bake() {
  local blender=${BLENDER:-blender} command=(--command sinew)
  case $("$blender" --version | sed -n 's/^Blender //p') in
    3.* | 4.0* | 4.1*)
      command=(--addons sinew --python-expr "from sinew.cli import command_line; command_line.main()" --) ;;
  esac
  exec "$blender" -b "$file" "${command[@]}" bake --output "$folder" --frames="$frames" "$@"
}

file=$1 folder=$2 frames=$3
case ${SINEW_STEP:-} in
  bake)
    start=$((first + SLURM_ARRAY_TASK_ID * length)) end=$((first + (SLURM_ARRAY_TASK_ID + 1) * length - 1))
    bake --chunk="$start-$((end < last ? end : last))" "${@:5}" ;;
  verify) bake --verify "${@:5}" ;;
  *)
    tasks=$(((last - first) / length + 1))
    baking=$(sbatch --parsable --job-name=sinew-bake --array="0-$((tasks - 1))" --export=ALL,SINEW_STEP=bake "$0" "$@")
    sbatch --parsable --job-name=sinew-verify --dependency="afterok:${baking%%;*}" \
      --export=ALL,SINEW_STEP=verify "$0" "$@" | sed "s/^/${baking%%;*} /" ;;
esac
