within PositioningStage.Effects;
model SlantedDamping "viscous friction that differs between the two directions"
  extends Common.Interfaces.Friction;
  parameter Real slant(unit="N.s/m", min=-2000.0, max=2000.0) = 0.0
    "Half the difference of the dampings";
equation
  f = slant*noEvent(abs(v));
  annotation (
    __Workbench(effect(
      size="slant", matters=5.0,
      separation="runs at several constant speeds, both ways")),
    Documentation(info="<html>
<p>A worn screw resists one way more than the other. Beside viscous friction <code>d</code> the dampings
are <code>d + slant</code> and <code>d - slant</code>.</p>
<h4>References</h4>
<p>A. Janot, P. C. Young, M. Gautier (2017), International Journal of Control 90(4), 643-660.</p>
</html>"));
end SlantedDamping;
