"""Commands for the wheelset alone, one module each, imported only when its command runs."""

COMMANDS = {
    "rig": "make recordings on a virtual rig",
    "accuracy": "judge estimators against the truth of the virtual rig",
}
