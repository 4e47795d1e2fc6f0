"""Run folders of every verb: loaded, exported, and their dampers as a study takes them."""
