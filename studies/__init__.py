"""Studies on the public names of mrwork: a folder for each question, run as `python studies/NAME/study.py`."""
