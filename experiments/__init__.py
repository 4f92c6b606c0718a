"""The contract that stimuli, server and analysis share: what a study is, what a clip is, what a rating is."""
