#!/usr/bin/env bash
# The first hour with the product, step by step, from the top of a fresh copy of the repository:
#
#   docs/scripts/first_hour.sh                   all steps, beginning with an environment of its own
#   docs/scripts/first_hour.sh flight review     some steps, with the python that is on the path
#
# After each step it prints seconds of processor time, the largest memory of a process, and what the step left on disk.
# Everything is written to the folder first_hour, or to $FIRST_HOUR; FIRST_HOUR_CASES=20 flies few cases and short searches.
set -euo pipefail
cd "$(dirname "$0")/../.."
folder=${FIRST_HOUR:-first_hour}
cases=${FIRST_HOUR_CASES:-} searches=${FIRST_HOUR_CASES:+1}
few=(${cases:+assurance.search_starts=8 assurance.search_population=5 assurance.search_generations=2 assurance.domain_cases=5})
steps=(set_up flight flight_again start rule sweep review evidence learn)
mkdir -p "$folder"

measured() { # NAME COMMAND...: run it, and print what it took
  FOLDER=$folder "${PYTHON:-python3}" - "$@" <<'PYTHON'
import os
import pathlib
import resource
import subprocess
import sys

name, *command = sys.argv[1:]


def size() -> int:
    return sum(path.lstat().st_size for path in pathlib.Path(os.environ["FOLDER"]).rglob("*"))


before = size()
code = subprocess.run(command, stdin=subprocess.DEVNULL).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN)
unit = 1e6 if sys.platform == "darwin" else 1e3  # ru_maxrss in bytes there, in kilobytes here
print(
    f"== {name}: {used.ru_utime + used.ru_stime:.1f} s of processor time, {used.ru_maxrss / unit:.0f} MB of memory, "
    f"{(size() - before) / 1e6:.1f} MB written",
    flush=True,
)
sys.exit(code)
PYTHON
}

pipeline() { # STEP NAME ARGUMENTS...: a run in a folder of its own
  local step=$1 name=$2
  shift 2
  measured "$step" python -m pipeline "$@" hydra.run.dir="$folder/$name"
}

set_up() {
  "${PYTHON:-python3}" -m venv "$folder/venv"
  measured "set-up" "$folder/venv/bin/python" -m pip install --quiet --require-hashes -r requirements.txt
}

flight() { pipeline "first flight" flight +experiment=fly controller=champion_27; }

flight_again() { pipeline "second flight" flight_again +experiment=fly controller=champion_27; }

start() { pipeline "a start of one's own" start +experiment=fly controller=champion_27 'deputy.initial_position_m=[60,-20,30]'; }

rule() {
  sed '/# distance near$/s/positive_large/positive_small/' conf/controller/paper_champion.yaml >"$folder/mine.yaml"
  measured "a rule of one's own" python -m fis_tools diff conf/controller/paper_champion.yaml "$folder/mine.yaml"
  pipeline "its flight" rule +experiment=fly controller="$folder/mine.yaml"
}

sweep() {
  measured "a sweep" python -m pipeline -m +experiment=evaluate controller=paper_champion,natural_motion monte_carlo.num_cases="${cases:-200}" \
    hydra.sweep.dir="$folder/sweep"
}

review() { measured "a review" python -m fis_tools review conf/controller/champion_27.yaml -o "$folder/review.html"; }

evidence() { pipeline "evidence" evidence +experiment=assure controller=paper_champion assurance.num_cases="${cases:-1000}" assurance.searches="${searches:-4}" "${few[@]}"; }

learn() {
  measured "learning from a table" python -m fis_tools learn docs/examples/iris.csv --target species -o "$folder/iris.json"
  measured "what was learned" python -m fis_tools explain "$folder/iris.json" --inputs petal_length=5,petal_width=1.6
}

for step in "${@:-${steps[@]}}"; do
  if ! printf '%s\n' "${steps[@]}" | grep -qx -- "$step"; then
    echo "There is no step '$step'; choose some of: ${steps[*]}" >&2
    exit 2
  fi
  printf '\n-- %s\n' "$step"
  "$step"
  if [ "$step" = set_up ]; then
    PATH=$(cd "$folder" && pwd)/venv/bin:$PATH
    NUMBA_CACHE_DIR=$(cd "$folder" && pwd)/compiled
    export PATH NUMBA_CACHE_DIR
  fi
done
