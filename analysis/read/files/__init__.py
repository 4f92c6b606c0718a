"""Files as people have them, each read into the same cells of text: CSV, Excel, SPSS, JSON, Psych-DS."""
