"""What ``import tablegen`` offers: functions and results for scripts, notebooks, and the commands themselves."""
