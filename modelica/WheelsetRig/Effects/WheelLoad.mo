within WheelsetRig.Effects;
model WheelLoad "Wheel load other than nominal"
  extends Quantities.PartialQuantity;
  parameter Real gain(unit="1", min=-0.3, max=0.3) = 0.0 "Relative change";
equation
  actual = nominal*(1.0 + gain);
  annotation (Documentation(info="<html>
<p><code>actual = nominal*(1 + gain)</code>. Changes adhesion in proportion and the stiffness of the
contact with the power 2/3.</p>
</html>"));
end WheelLoad;
