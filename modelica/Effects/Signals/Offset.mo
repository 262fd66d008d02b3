within Effects.Signals;
model Offset "A zero that is wrong"
  extends Interfaces.Signal;
  parameter Real offset = 0.0 "Added to the value, in its unit";
equation
  y = u + offset;
  annotation (Documentation(info="<html>
<p><code>y = u + offset</code>.</p>
</html>"));
end Offset;
