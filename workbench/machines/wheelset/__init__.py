"""What the workbench has for the wheelset on a roller rig alone: virtual rig and baselines."""
