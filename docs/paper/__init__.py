"""The paper's printed numbers beside ours, one figure a module; docs/make_paper.py writes the page and its pictures."""
