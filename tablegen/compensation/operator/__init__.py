"""An identified operator of the piezo: what a settled line of any size does; see docs/operator.md."""
