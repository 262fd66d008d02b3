within ServoPendulum.Friction;
model ViscousFriction "Viscous friction of gear and bearings"
  extends Common.RotationalFriction.Viscous(damping(max=0.2));
  annotation (
    __Workbench(effect(
      size="damping", matters=2e-4, slots={"friction"},
      separation="free swings, which the motor's induced voltage does not damp")),
    Documentation(info="<html>
<p>Of grease. A driven motor is damped by what it induces too, <code>kt^2/R</code>.</p>
</html>"));
end ViscousFriction;
