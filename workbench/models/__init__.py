"""An FMU: what it says of itself, opening and calling it, its trial, Modelica and its compiler."""
