"""The job descriptions of docs/farm, run for real: four chunks give the bytes of a single bake, also when one of them
was killed and the job is run again. With BLENDER, in a profile in which Sinew is enabled, and SINEW_OPENJD, the
folder of openjd-cli.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FARM = ROOT / "docs" / "farm"
BLENDER = os.environ["BLENDER"]
VERSION = subprocess.run([BLENDER, "--version"], capture_output=True, text=True).stdout.split()[1]
KNOWS_COMMANDS = tuple(map(int, VERSION.split(".")[:2])) >= (4, 2)
COMMAND = (
    ["--command", "sinew"]
    if KNOWS_COMMANDS
    else ["--addons", "sinew", "--python-expr", "from sinew.cli import command_line; command_line.main()", "--"]
)
FRAMES, PER_CHUNK = "1-40", 10

# In place of Blender: dies on frame 25, once.
DYING = """#!/usr/bin/env bash
[ "$1" = -b ] || exec {blender} "$@"
exec {blender} "$1" "$2" --python {script} "${{@:3}}"
"""
DIE = """
import os, signal
import bpy

def die(scene, *_):
    if scene.frame_current == 25 and not os.path.exists({mark!r}):
        open({mark!r}, "w").close()
        os.kill(os.getpid(), signal.SIGKILL)

bpy.app.handlers.frame_change_post.append(die)
"""


def run(*words, **more):
    return subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=300, **more)


def sinew(*words, file=None):
    return run(BLENDER, "-b", *([file] if file else []), *COMMAND, *words)


@pytest.fixture(scope="module")
def shot(tmp_path_factory):
    path = tmp_path_factory.mktemp("shot") / "a shot.blend"
    done = sinew("import", ROOT / "data" / "capsule", "-o", path, "--pose", "walk.dmat")
    assert done.returncode == 0, done.stderr
    return path


@pytest.fixture(scope="module")
def single(shot):
    """{name: bytes} of one bake without chunks."""
    folder = shot.parent / "single"
    done = sinew("bake", "-o", folder, "--frames", FRAMES, file=shot)
    assert done.returncode == 0, done.stderr
    found = contents(folder)
    assert sorted(found) == ["capsule.pc2", "capsule.pc2.json", "capsule.pc2.world.npy"]
    return found


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture
def dying_blender(tmp_path):
    script, program = tmp_path / "die.py", tmp_path / "blender"
    script.write_text(DIE.format(mark=str(tmp_path / "died")))
    program.write_text(DYING.format(blender=BLENDER, script=script))
    program.chmod(0o755)
    return program


# --- Open Job Description -------------------------------------------------------------------------


def openjd(*words):
    return run(sys.executable, "-m", "openjd", *words, env={**os.environ, "PYTHONPATH": os.environ["SINEW_OPENJD"]})


def openjd_job(shot, output, *words, **parameters):
    parameters = {
        "BlendFile": shot,
        "Output": output,
        "Frames": FRAMES,
        "FramesPerChunk": PER_CHUNK,
        "Blender": BLENDER,
        **parameters,
    }
    named = [word for name, value in parameters.items() for word in ("-p", f"{name}={value}")]
    return openjd("run", FARM / "openjd.yaml", *words, *named)


def test_openjd_takes_the_template():
    done = openjd("check", FARM / "openjd.yaml")
    assert done.returncode == 0, done.stdout


def test_openjd_bakes_four_chunks_and_verifies(shot, single, tmp_path):
    done = openjd_job(shot, tmp_path / "out put")
    assert done.returncode == 0, done.stdout
    assert [line.split("= ")[1] for line in done.stdout.splitlines() if "Frame(CHUNK[INT]) =" in line] == [
        "1-10",
        "11-20",
        "21-30",
        "31-40",
    ]
    assert "capsule.pc2 is complete: 40 frames" in done.stdout
    assert contents(tmp_path / "out put") == single


def test_openjd_goes_on_after_a_chunk_was_killed(shot, single, tmp_path, dying_blender):
    output = tmp_path / "out"
    killed = openjd_job(shot, output, Blender=dying_blender)
    assert killed.returncode != 0 and (tmp_path / "died").exists()
    assert os.listdir(output) == ["capsule.pc2.part"]
    failed = openjd_job(shot, output, "--step", "Verify", "--no-run-dependencies")
    assert failed.returncode != 0 and "frames are missing" in failed.stdout
    again = openjd_job(shot, output, Blender=dying_blender)
    assert again.returncode == 0, again.stdout
    assert contents(output) == single


def test_openjd_hands_its_options_on(shot, tmp_path):
    done = openjd_job(shot, tmp_path, Frames="1-9:2", FramesPerChunk=2, Format="mdd", Objects="capsule")
    assert done.returncode == 0, done.stdout
    assert "Chunks run: 4" in done.stdout  # with the one that verifies
    assert "capsule.mdd is complete: 5 frames" in done.stdout
    failed = openjd_job(shot, tmp_path / "none", Objects="Nobody", UntilSubdivision="YES")
    assert failed.returncode != 0 and "there is no object Nobody" in failed.stdout


# --- Slurm ----------------------------------------------------------------------------------------

# In place of sbatch: runs what it is given at once, and gives the job a number.
SBATCH = """#!/usr/bin/env bash
echo "$@" >>{log}
number=$(wc -l <{log}) tasks=
while [[ $1 == --* ]]; do
  case $1 in
    --array=*) IFS=- read -r first last <<<"${{1#--array=}}"; tasks=$(seq "$first" "$last") ;;
    --export=ALL,*) export "${{1#--export=ALL,}}" ;;
  esac
  shift
done
for task in ${{tasks:-none}}; do
  SLURM_ARRAY_TASK_ID=$task "$@" >>{log}.out 2>&1
done
echo "$number;cluster"
"""


def slurm(tmp_path, *words, blender=BLENDER):
    (tmp_path / "bin").mkdir(exist_ok=True)
    sbatch = tmp_path / "bin" / "sbatch"
    sbatch.write_text(SBATCH.format(log=tmp_path / "log"))
    sbatch.chmod(0o755)
    path = f"{sbatch.parent}:{os.environ['PATH']}"
    return run(FARM / "slurm.sh", *words, env={**os.environ, "PATH": path, "BLENDER": str(blender)})


def test_slurm_submits_an_array_and_what_verifies_it(shot, single, tmp_path):
    output = tmp_path / "out put"
    done = slurm(tmp_path, shot, output, FRAMES, PER_CHUNK)
    assert (done.returncode, done.stdout) == (0, "1 2;cluster\n"), done.stderr
    array, verify = (tmp_path / "log").read_text().splitlines()
    assert "--array=0-3" in array and "--dependency=afterok:1 " in verify
    assert "capsule.pc2 is complete: 40 frames" in (tmp_path / "log.out").read_text()
    assert contents(output) == single


def test_slurm_takes_steps_and_options(shot, tmp_path):
    done = slurm(tmp_path, shot, tmp_path / "out", "-3-7:2", 3, "--format", "mdd")
    assert done.returncode == 0, done.stderr
    assert "--array=0-1" in (tmp_path / "log").read_text()
    assert "capsule.mdd is complete: 6 frames" in (tmp_path / "log.out").read_text()


@pytest.mark.parametrize(
    "frames, per_task, chunks",
    [
        ("1-0240", 120, ["1-120", "121-240"]),
        ("0001-0010", 6, ["1-6", "7-10"]),
        ("-010-08:09", 1, ["-10--2", "-1-7", "8-8"]),
        ("00-0", 1, ["0-0"]),
    ],
)
def test_slurm_takes_frames_that_begin_with_zero(tmp_path, frames, per_task, chunks):
    """Which are decimal to Blender, and to the shell octal."""
    said = tmp_path / "blender"
    said.write_text('#!/usr/bin/env bash\n[ "$1" = -b ] || { echo Blender 5.2; exit; }\necho "$@"\n')
    said.chmod(0o755)
    done = slurm(tmp_path, "a.blend", "out", frames, per_task, blender=said)
    assert done.returncode == 0, done.stderr
    *bakes, verify = (tmp_path / "log.out").read_text().splitlines()
    assert [line.rpartition("--chunk=")[2] for line in bakes] == chunks
    assert verify.endswith(f"--frames={frames} --verify")


@pytest.mark.parametrize("words", [[], ["a.blend", "out", "1", "10"], ["a.blend", "out", "1-9", "0"]])
def test_slurm_says_how_it_is_called(tmp_path, words):
    done = slurm(tmp_path, *words)
    assert done.returncode == 2 and "slurm.sh FILE.blend FOLDER A-B[:STEP]" in done.stderr
    assert not (tmp_path / "log").exists()


def test_slurm_refuses_frames_that_run_backwards(tmp_path):
    done = slurm(tmp_path, "a.blend", "out", "9-1", "3")
    assert (done.returncode, done.stderr) == (2, "the last frame (1) comes before the first (9)\n")


# --- Flamenco -------------------------------------------------------------------------------------


def flamenco(**settings):
    return run("node", Path(__file__).parent / "flamenco.js", FARM / "sinew_bake.js", json.dumps(settings))


def tasks_of(**settings):
    done = flamenco(**settings)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)["tasks"]


def command_line(task):
    """As a worker puts it together."""
    (command,) = task["commands"]
    assert command["name"] == "blender-render" and task["type"] == "blender"
    parameters = command["parameters"]
    assert (parameters["exe"], parameters["exeArgs"]) == ("{blender}", "{blenderArgs}")
    return [BLENDER, "-b", "-y", *parameters["argsBefore"], parameters["blendfile"], *parameters["args"]]


def test_flamenco_makes_a_task_a_chunk_and_one_that_verifies():
    tasks = tasks_of(frames=FRAMES, chunk_size=PER_CHUNK, output="/out", blendfile="/a.blend")
    names = ["bake-1-10", "bake-11-20", "bake-21-30", "bake-31-40"]
    assert [task["name"] for task in tasks] == [*names, "verify"]
    assert [task["dependencies"] for task in tasks] == [[], [], [], [], names]
    assert command_line(tasks[0])[3:] == [
        "/a.blend",
        "--command",
        "sinew",
        "bake",
        "--output",
        "/out",
        "--frames=1-40",
        "--format",
        "pc2",
        "--chunk=1-10",
    ]


def test_flamenco_hands_its_settings_on():
    tasks = tasks_of(frames="1-3", output="/out", blendfile="a", objects="A,B", format="mdd", until_subdivision=True)
    assert len(tasks) == 2
    words = " ".join(command_line(tasks[0]))
    assert words.endswith("--format mdd --chunk=1-3 --objects A,B --until-subdivision")


def test_flamenco_refuses_several_ranges():
    done = flamenco(frames="1-3, 7", chunk_size=2, output="/out", blendfile="a")
    assert done.returncode != 0 and "1-3, 7 is not a range of frames; write it like 1-240" in done.stderr


@pytest.mark.skipif(not KNOWS_COMMANDS, reason="the job type is for Blender 4.2 and later")
def test_flamencos_commands_bake(shot, single, tmp_path):
    for task in tasks_of(frames=FRAMES, chunk_size=PER_CHUNK, output=str(tmp_path / "out"), blendfile=str(shot)):
        done = run(*command_line(task))
        assert done.returncode == 0, done.stderr
    assert contents(tmp_path / "out") == single
