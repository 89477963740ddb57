"""``inertia recover``: what was lost is said; what is no run is no run."""

import pytest

from tests.helpers.saved_runs import written
from uq.cli.main import main


def test_the_command_says_what_was_lost(tmp_path, capsys):
    path, output = tmp_path / "run.mcap", tmp_path / "new.mcap"
    written(path)
    data = path.read_bytes()
    assert main(["recover", str(path), "-o", str(output)]) == 0
    assert main(["recover", str(path), "-o", str(output)]) == 2
    path.write_bytes(data[: len(data) // 2])
    output.unlink()
    assert main(["recover", str(path), "-o", str(output)]) == 1
    out, err = capsys.readouterr()
    assert "the number of lost messages is unknown" in out.splitlines()[-1]
    assert "the file is cut" in out
    assert "damaged" not in out
    assert err.startswith("error: output exists")
    assert path.read_bytes() == data[: len(data) // 2]


@pytest.mark.parametrize("content", [b"", b"nonsense" * 100])
def test_what_is_no_run_is_no_run(tmp_path, content, capsys):
    (tmp_path / "x.mcap").write_bytes(content)
    assert main(["recover", str(tmp_path / "x.mcap"), "-o", str(tmp_path / "y.mcap")]) == 2
    assert "nothing to recover" in capsys.readouterr().err
    assert not (tmp_path / "y.mcap").exists()
