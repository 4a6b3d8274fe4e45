"""The report: tables on the screen, one HTML file with its pictures inside, CSV files beside it."""
