within WheelsetRig.Effects;
model WheelRadius "Wheel that is larger or smaller than measured"
  extends Quantities.PartialQuantity;
  parameter Units.Length delta(min=-0.04, max=0.01) = 0.0 "Added to the radius";
equation
  actual = nominal + delta;
  annotation (Documentation(info="<html>
<p><code>actual = nominal + delta</code>; wear takes up to 35 mm. Shows while coasting as a ratio of
the speeds, and in braking as a lever of the creep force.</p>
</html>"));
end WheelRadius;
