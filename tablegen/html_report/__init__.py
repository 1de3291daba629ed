"""A scan or a build as one HTML page that needs no network and no script: charts, tables, and ranked findings."""
