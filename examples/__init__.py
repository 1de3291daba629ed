"""The example pair of a scanner and a scan, which ``tablegen init`` copies."""
