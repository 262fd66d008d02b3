within ServoPendulum.Friction;
model DriveFriction "Dry friction of the gear that grows with the torque of the motor"
  extends Common.RotationalFriction.LoadDependent(v0=1e-4, mu(max=0.9));
  annotation (
    __Workbench(effect(
      size="mu", matters=0.01, slots={"driveFriction"}, after="LoadFriction",
      separation="lifting and lowering a weight at the same speed")),
    Documentation(info="<html>
<p>The first stages of a gear turn fast and carry little but the motor's torque: a gear that is driven
loses more than one that drives back.</p>
<h4>References</h4>
<p>M. Duclusaud et al. (2025), IEEE ICRA, model M5 (directional).</p>
</html>"));
end DriveFriction;
