"""Files written whole."""

from __future__ import annotations

from pathlib import Path

import pytest

from tactile_bayes.files import write_atomically


def test_an_exception_in_the_middle_leaves_the_old_file(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")

    def interrupted():
        with write_atomically(path) as temporary:
            temporary.write_text("half of the n")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_the_new_file_appears_only_at_the_end_and_where_a_link_points(tmp_path):
    target, link = tmp_path / "a.txt", tmp_path / "link.txt"
    target.write_text("old")
    link.symlink_to(target)
    with write_atomically(link) as temporary:
        assert temporary.parent == Path(tmp_path).resolve()
        temporary.write_text("new")
        assert target.read_text() == "old"
    assert link.is_symlink()
    assert target.read_text() == "new"


def test_a_folder_that_is_not_there_is_named(tmp_path):
    with pytest.raises(FileNotFoundError) as refusal, write_atomically(tmp_path / "nowhere" / "a.txt"):
        pass
    assert refusal.value.filename == str(tmp_path.resolve() / "nowhere")
