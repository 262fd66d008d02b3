within PositioningStage.Effects;
model ViscousFriction "viscous friction of screw and rails"
  extends Common.Friction.Viscous(damping(max=2000.0));
  annotation (
    __Workbench(effect(
      size="damping", matters=5.0,
      separation="runs at several constant speeds")),
    Documentation(info="<html>
<p>Of grease, and of the motor's iron.</p>
</html>"));
end ViscousFriction;
