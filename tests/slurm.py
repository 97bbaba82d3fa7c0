"""Stand-ins for SLURM's commands: jobs run on this machine, one by one, and are requeued once killed.

They show what a launcher or a script asks of SLURM, and that runs survive what SLURM does to them.
"""

import os
import stat
import sys
from pathlib import Path

SBATCH = """
import os, re, shutil, subprocess, sys
from pathlib import Path
jobs = Path(os.environ["SLURM_STAND_IN"])
if sys.argv[1] == "--run":
    script, number, indices, is_requeued = sys.argv[2], sys.argv[3], sys.argv[4], sys.argv[5] == "1"
    for index in indices.split(","):
        name = f"{number}_{index}" if index else number
        state = jobs / name
        given = {"ARRAY_JOB_ID": number, "ARRAY_TASK_ID": index} if index else {}
        given |= {"JOB_ID": number, "LOCALID": "0"}
        given |= {"PROCID": "0", "NTASKS": "1", "NODEID": "0", "NNODES": "1", "JOB_NODELIST": "here"}
        given |= {"JOB_NUM_NODES": "1"}
        environment = os.environ | {f"SLURM_{name}": value for name, value in given.items()}
        for attempt in range(5 if is_requeued else 1):
            state.write_text("RUNNING")
            # a signal to a job's group reaches the job alone, not what stands in for SLURM
            code = subprocess.run(["bash", script], env=environment, start_new_session=True).returncode
            if 0 <= code < 128:
                break
            with (jobs / "requeued").open("a") as stream:
                stream.write(f"{name}\\n")
        state.write_text("FAILED" if code else "COMPLETED")
else:
    number = str(100 + len(list(jobs.glob("*.sh"))))
    script = jobs / f"{number}.sh"
    shutil.copy(sys.argv[-1], script)
    lines = re.findall(r"^#SBATCH (.*)$", script.read_text(), re.M)
    indices = ""  # a job that is no array
    for first, last in re.findall(r"--array=(\\d+)-(\\d+)", " ".join(lines)):
        indices = ",".join(map(str, range(int(first), int(last) + 1)))
    for index in indices.split(","):
        (jobs / (f"{number}_{index}" if index else number)).write_text("PENDING")
    is_requeued = any("--requeue" in line for line in lines)
    words = [sys.executable, __file__, "--run", str(script), number, indices, str(int(is_requeued))]
    with (jobs / f"{number}.out").open("w") as log:
        subprocess.Popen(words, stdout=log, stderr=log, start_new_session=True)
    print("Submitted batch job", number)
"""
SACCT = """
import os
from pathlib import Path
print("JobID|State|NodeList")
for path in sorted(Path(os.environ["SLURM_STAND_IN"]).glob("*")):
    if path.suffix or path.name == "requeued":
        continue
    print(f"{path.name}|{path.read_text()}|here")
"""
SRUN = """
import os, sys
words = sys.argv[1:]
while words[0].startswith("-"):
    option = words.pop(0)
    if option in ("--output", "--error"):
        words.pop(0)
os.execvp(words[0], words)
"""
COMMANDS = {"sbatch": SBATCH, "sacct": SACCT, "srun": SRUN}


def installed(folder: Path) -> dict[str, str]:
    """Write the commands into a folder; return the environment in which they are found."""
    for name in ("bin", "jobs"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    for name, program in COMMANDS.items():
        path = folder / "bin" / name
        path.write_text(f"#!{sys.executable}\n{program}")
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return {
        "PATH": os.pathsep.join((str(folder / "bin"), os.environ["PATH"])),
        "SLURM_STAND_IN": str(folder / "jobs"),
    }


def states(folder: Path) -> dict[str, str]:
    """Return the states of the tasks so far, such as ``{"100_1": "RUNNING"}``."""
    return {path.name: path.read_text() for path in (folder / "jobs").glob("*_*")}


def requeued(folder: Path) -> list[str]:
    """Return the tasks that were killed and started again."""
    path = folder / "jobs" / "requeued"
    return path.read_text().split() if path.exists() else []
