within ServoPendulum.Friction;
model Stribeck "More friction close to standstill"
  extends Common.RotationalFriction.Stribeck(v0=1e-4, excess(max=0.2), vS(min=0.01, max=20.0));
  annotation (
    __Workbench(effect(
      size="excess", matters=1e-3, shapes(vS={0.1, 1.0}), slots={"friction"},
      separation="the torque at which the shaft breaks away, and that at which it stops")),
    Documentation(info="<html>
<p>A film of grease forms as the gear turns; the excess is what it then saves.</p>
</html>"));
end Stribeck;
