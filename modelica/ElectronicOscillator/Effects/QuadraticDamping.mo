within ElectronicOscillator.Effects;
model QuadraticDamping "damping that grows with the rate"
  extends Interfaces.PartialForce;
  parameter Real d2(unit="s2/V", min=-1e-4, max=1e-4) = 0.0 "Force per square of the rate";
equation
  f = d2*v*noEvent(abs(v));
  annotation (
    __Workbench(effect(
      size="d2", matters=5e-8,
      separation="how free swings fade")),
    Documentation(info="<html>
<p><code>f = d2*v*|v|</code>.</p>
</html>"));
end QuadraticDamping;
