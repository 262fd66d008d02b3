within WheelsetRig.Effects;
model RollerRadius "Roller that is larger or smaller than measured"
  extends Quantities.PartialQuantity;
  parameter Units.Length delta(min=-0.04, max=0.04) = 0.0 "Added to the radius";
equation
  actual = nominal + delta;
  annotation (Documentation(info="<html>
<p><code>actual = nominal + delta</code>. Shows while coasting as a ratio of the speeds, as a wheel
radius does, and in braking as a lever of the creep force on the roller.</p>
</html>"));
end RollerRadius;
