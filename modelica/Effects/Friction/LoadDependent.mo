within Effects.Friction;
model LoadDependent "Dry friction that grows with the load"
  extends Interfaces.Friction;
  parameter Real mu(unit="1", min=0.0) = 0.0 "Friction per load";
  parameter Units.Velocity v0(min=1e-9) = 0.01 "Velocity below which the sign is smoothed";
equation
  f = mu*abs(load)*tanh(v/v0);
  annotation (Documentation(info="<html>
<p><code>f = mu*|load|*tanh(v/v0)</code>: the law of Amontons. The load is what the slot hands in: a
normal force, the torque that a gear carries (<code>mu</code> is then of unit 1), or the pressure
behind a seal (<code>mu(unit=&quot;m2&quot;)</code>).</p>
<h4>References</h4>
<p>B. Armstrong-Helouvry et al. (1994), Automatica 30(7), 1083-1138.</p>
</html>"));
end LoadDependent;
