"""One reader of tables for every program: CSV in every encoding and dialect, Excel, SPSS and JSON."""
