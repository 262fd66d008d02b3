within Effects.Leaks;
model Steady "A flow that does not depend on the pressures"
  extends Interfaces.Flow;
  parameter Units.MassFlowRate rate(min=0.0) = 0.0 "What is drawn";
equation
  q = rate;
  annotation (Documentation(info="<html>
<p><code>q = rate</code>: a consumer with a regulator of its own.</p>
</html>"));
end Steady;
