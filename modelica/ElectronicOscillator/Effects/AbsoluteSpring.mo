within ElectronicOscillator.Effects;
model AbsoluteSpring "a spring with another stiffness on either side"
  extends Interfaces.PartialForce;
  parameter Real k1(unit="1", min=-1.0, max=1.0) = 0.0 "Half the difference of the stiffnesses";
equation
  f = k1*noEvent(abs(y));
  annotation (
    __Workbench(effect(
      size="k1", matters=0.004,
      separation="static force over displacement")),
    Documentation(info="<html>
<p><code>f = k1*|y|</code>: a diode in the feedback.</p>
</html>"));
end AbsoluteSpring;
