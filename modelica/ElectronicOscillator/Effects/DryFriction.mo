within ElectronicOscillator.Effects;
model DryFriction "dry friction"
  extends Interfaces.PartialForce;
  parameter Real coulomb(unit="V", min=0.0, max=0.05) = 0.0 "Friction while it moves";
  parameter Real v0(unit="V/s", min=1e-6) = 0.5 "Rate below which the sign is smoothed";
equation
  f = coulomb*tanh(v/v0);
  annotation (
    __Workbench(effect(
      size="coulomb", matters=1e-4,
      separation="how free swings fade")),
    Documentation(info="<html>
<p>Of a real oscillator; a circuit should have none.</p>
</html>"));
end DryFriction;
