"""What a study is: the tables of its TOML, its forms, rules and kinds of trial, as frozen data."""
