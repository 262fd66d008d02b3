within WheelsetRig.Effects;
model RollerRadius "A roller radius other than entered"
  extends Quantities.PartialRollerRadius;
  parameter Units.Length delta(min=-0.04, max=0.04) = 0.0 "Added to the radius";
equation
  y = u + delta;
  annotation (
    __Workbench(effect(
      size="delta", matters=1e-4,
      separation="a tape measure on wheel and roller")),
    Documentation(info="<html>
<p><code>y = u + delta</code>. Shows while coasting as a ratio of the speeds, as a wheel
radius does, and in braking as a lever of the creep force on the roller.</p>
</html>"));
end RollerRadius;
