"""An identified operator of the piezo: the settled line of any size; see docs/operator.md."""
