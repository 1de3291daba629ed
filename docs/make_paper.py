"""Write docs/paper/README.md and its pictures: the paper's printed numbers beside ours. Usage: make paper"""

from pathlib import Path

from paper.page import page, pictures

FOLDER = Path(__file__).parent / "paper"


def write(folder: Path) -> None:
    """The page as README.md, and its pictures."""
    (folder / "README.md").write_text(page(), encoding="utf-8")
    for name, data in pictures().items():
        (folder / name).write_bytes(data)


if __name__ == "__main__":
    write(FOLDER)
