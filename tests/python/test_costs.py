"""addon/sinew/profiling/costs.py, which needs no Blender: what is made of measured times."""

import importlib.util
import json
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

PATH = Path(__file__).resolve().parents[2] / "addon" / "sinew" / "profiling" / "costs.py"
spec = importlib.util.spec_from_file_location("costs", PATH)
costs = sys.modules["costs"] = importlib.util.module_from_spec(spec)
spec.loader.exec_module(costs)

SUBSURF, SMOOTH, ARMATURE = ("Sub", "SUBSURF"), ("Smooth", "SMOOTH"), ("Rig", "ARMATURE")


def cost(name, *times, **more):
    parts = [costs.Part(f"part {i}", "SMOOTH", ms, costs.CLOCK) for i, ms in enumerate(times)]
    return costs.ObjectCost((name, None), "MESH", parts, **more)


@pytest.mark.parametrize(
    "words, frames", [("1-40", (1, 40)), ("7-7", (7, 7)), ("-5-10", (-5, 10)), ("-9--3", (-9, -3))]
)
def test_frames_are_read(words, frames):
    assert costs.parse_frames(words) == frames


@pytest.mark.parametrize("words", ["", "5", "a-b", "1-2-3", "1..9", "1.5-3", " 1-2"])
def test_what_is_no_range_of_frames_is_said(words):
    with pytest.raises(ValueError, match="is not a range of frames; write it like 1-40"):
        costs.parse_frames(words)


def test_reversed_frames_are_said():
    with pytest.raises(ValueError, match=r"the last frame \(1\) comes before the first \(9\): swap them"):
        costs.parse_frames("9-1")


def test_frames_are_those_that_playing_shows():
    scene = SimpleNamespace(
        use_preview_range=False, frame_start=1, frame_end=250, frame_preview_start=20, frame_preview_end=30
    )
    assert costs.frames_of(scene) == (1, 250)
    scene.use_preview_range = True
    assert costs.frames_of(scene) == (20, 30)


@pytest.mark.parametrize("first, last", [(1, 40), (3, 3), (1, 250), (-20, 1000), (1, 41)])
def test_frames_are_spread_over_the_whole_range(first, last):
    frames = costs.spread(first, last)
    assert (frames[0], frames[-1]) == (first, last)
    assert len(frames) == len(set(frames)) == min(last - first + 1, costs.MOST_FRAMES)
    assert frames == sorted(frames)
    gaps = {b - a for a, b in zip(frames, frames[1:])}
    assert max(gaps, default=0) - min(gaps, default=0) <= 1
    assert [frame for block in costs.blocks(frames, 7) for frame in block] == frames


def difference(before, without, after, shares=1):
    """(milliseconds, noise) of each share."""
    parts = [costs.Part("a", "POSE", None, costs.DIFFERENCE) for _ in range(shares)]
    costs.set_difference(parts, before, without, after)
    assert len({(part.ms, part.noise_ms) for part in parts}) == 1
    return parts[0].ms, parts[0].noise_ms


def test_a_difference_is_free_of_a_steady_drift():
    frames = range(10)
    before = [5.0 + 0.1 * i for i in frames]
    after = [ms + 4.0 for ms in before]  # the machine has become slower meanwhile
    without = [ms + 2.0 - 3.5 for ms in before]
    assert difference(before, without, after) == (pytest.approx(3.5), pytest.approx(2.0))
    assert difference(before, without, after, shares=2) == (pytest.approx(1.75), pytest.approx(2.0))


def test_what_is_less_than_the_drift_is_nothing():
    assert difference([5.0] * 9, [5.5] * 9, [9.0] * 9) == (0.0, 2.0)
    assert difference([5.0] * 9, [5.1] * 9, [5.0] * 9) == (0.0, costs.LEAST_NOISE)  # dearer without


def test_more_frames_tell_smaller_differences():
    def noise(count):
        return costs.noise([5.0, 6.0] * count, [6.0, 5.0] * count)

    assert noise(2) == pytest.approx(4 * noise(32)) and noise(32) > costs.LEAST_NOISE


def test_one_bad_frame_says_nothing():
    before, without = [3.0] * 9, [1.0] * 9
    before[4], without[7] = 500.0, 900.0
    assert difference(before, without, [3.0] * 9)[0] == pytest.approx(2.0)


def test_an_object_costs_the_sum_of_what_was_measured():
    found = cost("a", 1.5, None, 2.0)
    assert found.ms == 3.5


def test_the_dearest_comes_first_and_what_costs_nothing_to_measure_is_left_out():
    found = costs.order([cost("little", 1), cost("nothing"), cost("much", 4, 5), cost("some", 3)])
    assert [each.name[0] for each in found] == ["much", "some", "little"]


@pytest.mark.parametrize(
    "modifiers, sentence",
    [
        ([ARMATURE, SMOOTH], None),
        ([ARMATURE, SUBSURF], "Sub runs on the graphics card or while drawing"),
        (
            [ARMATURE, SUBSURF, SMOOTH, ARMATURE],
            "Smooth comes after Sub, so the processor has to subdivide: move it before",
        ),
        ([SUBSURF, SMOOTH, ("Second", "SUBSURF")], "Second runs on the graphics card"),
        ([], None),
    ],
)
def test_what_keeps_subdivision_on_the_processor(modifiers, sentence):
    found = costs.about_subdivision(modifiers)
    assert len(found) == (sentence is not None)
    assert all(each.startswith(sentence) for each in found)


@pytest.mark.parametrize(
    "modifiers, names",
    [
        ([ARMATURE, SMOOTH], set()),
        ([], set()),
        ([ARMATURE, SUBSURF, SMOOTH], {"Sub", "Smooth"}),
        ([ARMATURE, ("Cloth", "CLOTH"), SUBSURF], {"Sub"}),
        ([("Mirror", "MIRROR"), ARMATURE], {"Mirror", "Rig"}),
    ],
)
def test_what_follows_the_deforming_modifiers_may_be_switched_off_but_for_simulations(modifiers, names):
    assert costs.after_deforming(modifiers, {"ARMATURE", "CORRECTIVE_SMOOTH", "SMOOTH", "HOOK"}) == names


def saving(ms, noise_ms=0.2):
    return costs.Part("a", "SAVES", ms, costs.DIFFERENCE, noise_ms)


@pytest.mark.parametrize(
    "found, words",
    [
        (cost("a", saves=saving(2.5)), "saves 2.50 ms"),
        (cost("a", saves=saving(0.0)), "saves below 0.20 ms"),
        (
            cost("a", reason="nothing deforms it that Sinew could take over"),
            "nothing deforms it that Sinew could take over",
        ),
        (cost("a", is_bound=True), "accelerated"),
        (cost("a", is_bound=True, reason="Its armature is gone"), "Its armature is gone"),
        (cost("a"), ""),
    ],
)
def test_what_accelerate_has_to_do_with_it(found, words):
    assert costs.verdict(found) == words


def test_only_differences_drown_in_the_noise():
    assert costs.part_text(saving(0.0)) == "below 0.20 ms"
    assert costs.part_text(saving(0.3)) == "0.30 ms"
    assert costs.part_text(costs.Part("a", "SMOOTH", 0.0, costs.CLOCK)) == "0.00 ms"
    assert costs.part_text(costs.Part("a", "KEYS", None, "absolute keys cannot be muted")) == (
        "absolute keys cannot be muted"
    )


def test_the_report_has_a_row_for_each_object_and_each_part():
    dear = cost("dear", 2.0, 1.0, saves=saving(1.0), remarks=["It is dear."])
    profile = costs.Profile([1, 2, 9], 4.0, 0.1, [dear, cost("cheap", 0.5, reason="no")])
    assert costs.rows(profile) == [
        ("dear", "3.00 ms", "saves 1.00 ms"),
        ("  part 0", "2.00 ms", ""),
        ("  part 1", "1.00 ms", ""),
        ("cheap", "0.50 ms", "no"),
        ("  part 0", "0.50 ms", ""),
        ("Everything else", "0.50 ms", ""),
    ]
    assert costs.remarks(profile) == ["dear: It is dear."]
    assert costs.heading(profile) == "3 frames from 1 to 9: 4.00 ms per frame, give or take 0.10 ms"
    assert costs.heading(costs.Profile([4], 4.0, 0.1, [])).startswith("frame 4: ")


def test_the_rows_add_up_to_the_frame():
    shared = [costs.Part("Keyframes", "KEYFRAMES", 0.25, costs.DIFFERENCE)]
    profile = costs.Profile([1], 4.0, 0.1, [cost("a", 2.0, None), cost("b", 0.5)], shared)
    assert costs.last_rows(profile) == [("Keyframes", "0.25 ms"), ("Everything else", "1.25 ms")]
    assert costs.about_rest(profile) == "" and profile.document()["everything_else_ms"] == 1.25
    assert sum(float(time.split()[0]) for what, time, _ in costs.rows(profile) if what[0] != " ") == 4.0


def test_rows_that_add_up_to_more_than_the_frame_say_so():
    profile = costs.Profile([1], 4.0, 0.1, [cost("a", 3.0), cost("b", 1.5)])
    assert costs.last_rows(profile) == [("Done at the same time", "-0.50 ms")]
    assert costs.remarks(profile) == [
        "What was measured adds up to 0.50 ms more than the frame: Blender evaluates several things at the same time"
    ]
    document = profile.document()
    assert (document["everything_else_ms"], document["at_the_same_time_ms"]) == (0.0, 0.5)


def test_the_document_is_json():
    profile = costs.Profile([1], 4.0, 0.1, [cost("a", 2.0, None)])
    found = json.loads(json.dumps(profile.document()))
    assert found["objects"][0]["name"] == "a" and found["objects"][0]["ms"] == 2.0
    assert found["objects"][0]["parts"][1] == {
        "name": "part 1",
        "kind": "SMOOTH",
        "ms": None,
        "how": costs.CLOCK,
        "noise_ms": 0.0,
    }
