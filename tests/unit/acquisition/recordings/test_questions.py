"""What a recording leaves out is asked as data: every choice can be taken, and nobody has to read the sentence."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from acquisition.errors import NeedsAnswer
from acquisition.recordings.identify import open_recording
from acquisition.recordings.questions import Missing
from acquisition.recordings.reading import ReadOptions
from acquisition.recordings.recording import Recording

T = [i / 20 for i in range(60)]
THREE = "\n".join(f"{t},{0.5 + i % 4},{0.25 + i % 3},{0.75 + i % 5}" for i, t in enumerate(T)) + "\n"

FILES = {
    "units": "t,x,y,z\n" + THREE,
    "names alike": "t (s),x (m),x (m),x (m)\n" + THREE,
    "a name that looks numbered": "t (s),x (m),x [2] (m),x (m)\n" + THREE,
    "names of one letter": "t (s),X (m),x (m),z (m)\n" + THREE,
    "no times": "x,y,z,a\n" + "\n".join(f"{i % 4}.5,{i % 3}.5,{i % 5}.5,{i % 6}.5" for i in range(60)) + "\n",
    "ticks": "time (ticks),x (m)\n" + "\n".join(f"{50 * i},{0.5 + i % 4}" for i in range(60)) + "\n",
    "a unit that nobody knows": "t (s),B (uT)\n" + "\n".join(f"{t},{0.5 + i % 4}" for i, t in enumerate(T)) + "\n",
    "runs": '"Position (mm) Run #1";"Position (mm) Run #2"\n' + "".join(f"{i % 7},5;{i % 5},5\n" for i in range(60)),
    "two columns of MotionSensor.vi": "Motion Sensor Data File\n" + "".join(f"{t}\t{i % 7}\n" for i, t in enumerate(T)),
}


def walk(path: Path, answers: dict[str, Any]) -> Iterator[Recording]:
    """Answer one question after the other, with all runs and channels that are listed; yield what is read."""
    try:
        recording = open_recording(path, ReadOptions.of(answers))
    except NeedsAnswer as error:
        need = error.question.needs[0]
        if need.what.value in answers or (need.choices and need.example not in need.choices):
            pytest.fail(f"cannot be answered: {error}")
        choices = need.choices if need.what in (Missing.RUN, Missing.CHANNEL) else (need.example,)
        for choice in choices:
            yield from walk(path, {**answers, need.what.value: choice})
    else:
        yield recording


@pytest.mark.parametrize("name", FILES)
def test_every_choice_of_a_question_can_be_taken(tmp_path: Path, name: str) -> None:
    """Each listed run and channel opens by its listed name, with different samples; all examples together answer."""
    path = tmp_path / "run.txt"
    path.write_text(FILES[name], encoding="utf-8")
    with pytest.raises(NeedsAnswer) as caught:
        open_recording(path)
    recordings = list(walk(path, {}))
    first = caught.value.question.needs[0]
    choices = len(first.choices) if first.what in (Missing.RUN, Missing.CHANNEL) else 1
    assert len(recordings) >= choices
    assert len({each.samples.distance.tobytes() for each in recordings}) == len(recordings)
    assert len(open_recording(path, ReadOptions.of(caught.value.question.examples)).samples) == 60
