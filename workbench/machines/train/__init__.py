"""What the workbench has for the train alone: what reads its recordings, and a virtual rig."""
