"""What benchmarks/results.py runs: a file each section of the page."""
