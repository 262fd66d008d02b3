within ElectronicOscillator.Effects;
model DisplacedDamping "damping that grows with the square of the displacement"
  extends Interfaces.PartialForce;
  parameter Real dy(unit="s/V2", min=-0.1, max=0.1) = 0.0 "Damping per square of the displacement";
equation
  f = dy*y^2*v;
  annotation (
    __Workbench(effect(
      size="dy", matters=5e-5,
      separation="how free swings of several amplitudes fade")),
    Documentation(info="<html>
<p><code>f = dy*y^2*v</code>, after B. van der Pol (1926): a multiplier whose output lags.</p>
</html>"));
end DisplacedDamping;
