within Effects.Signals;
model Gain "A gain that is wrong"
  extends Interfaces.Signal;
  parameter Real gain(unit="1", min=-1.0) = 0.0 "Relative change";
equation
  y = u*(1.0 + gain);
  annotation (Documentation(info="<html>
<p><code>y = u*(1 + gain)</code>.</p>
</html>"));
end Gain;
