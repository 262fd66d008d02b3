within WheelsetRig.Effects;
model WheelRadius "A wheel radius other than entered"
  extends Quantities.PartialWheelRadius;
  parameter Units.Length delta(min=-0.04, max=0.01) = 0.0 "Added to the radius";
equation
  y = u + delta;
  annotation (
    __Workbench(effect(
      size="delta", matters=5e-5,
      separation="a tape measure on wheel and roller")),
    Documentation(info="<html>
<p><code>y = u + delta</code>; wear takes up to 35 mm. Shows while coasting as a ratio of
the speeds, and in braking as a lever of the creep force.</p>
</html>"));
end WheelRadius;
