"""What is printed and what is in files: JSON objects, CSV, NetCDF, tables and sentences; atomic writing."""
