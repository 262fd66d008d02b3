within ServoPendulum.Friction;
model LoadStribeck "Dry friction that grows with the load, the more so close to standstill"
  extends Common.Interfaces.Friction;
  parameter Real mu(unit="1", min=0.0, max=0.9) = 0.0 "Excess at standstill, per load";
  parameter Real vS(unit="rad/s", min=0.01, max=20.0) = 0.1 "Speed at which 1/e of it is left";
  parameter Real v0(unit="rad/s", min=1e-9) = 1e-4 "Speed below which the sign is smoothed";
equation
  f = mu*noEvent(abs(load))*exp(-(v/vS)^2)*tanh(v/v0);
  annotation (
    __Workbench(effect(
      size="mu", matters=0.01, shapes(vS={0.1, 1.0}), slots={"friction"},
      separation="the torque at which the shaft breaks away, with two weights")),
    Documentation(info="<html>
<p><code>f = mu*|load|*exp(-(v/vS)^2)*tanh(v/v0)</code>: what <code>Stribeck</code> adds to dry friction,
of a friction that grows with the load. A gear that is loaded squeezes its film out.</p>
<h4>References</h4>
<p>M. Duclusaud et al. (2025), IEEE ICRA, model M4.</p>
</html>"));
end LoadStribeck;
