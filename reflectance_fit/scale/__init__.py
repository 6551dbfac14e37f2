"""Many tasks on one machine or several; what the tasks do is given by the workflow."""
