within WheelsetRig.Effects;
model BeddingIn "Pad friction that is low in the first seconds of contact"
  extends Brakes.PartialPadFriction;
  parameter Real loss(unit="1", min=-0.2, max=0.4) = 0.0 "Share of friction lost at first contact";
  parameter Real tau(unit="s", min=0.5, max=4.0) = 2.0 "Time constant";
  parameter Units.Force F0(min=1.0) = 500.0 "Normal force from which the pads count as touching";
  Real contact(unit="s", start=0.0, fixed=true) "Time since first contact";
equation
  mu = level*(1.0 - loss*exp(-contact/tau));
  der(contact) = tanh(Fperp/F0);
  annotation (
    __Workbench(effect(
      size="loss", matters=0.01,
      shapes(tau={0.7, 1.4, 2.0, 3.0}),
      separation="dry stops from two pressures: time against energy")),
    Documentation(info="<html>
<p><code>mu = level*(1 - loss*exp(-t/tau))</code>, t the time of contact; loss -0.1 to 0.2, tau 0.5
to 4 s. It repeats in dry stops and follows time, where a film of water follows energy.</p>
<h4>Limits</h4>
<p>Pads that part and touch again go on where they were. Assumed form: no measurement is known.</p>
</html>"));
end BeddingIn;
