within WheelsetRig.Contact;
function creepForce "Longitudinal creep force of one wheel after Polach"
  input Units.Velocity w "Slip velocity, positive in braking";
  input Units.Velocity v "Rolling velocity";
  input Units.Force Q "Wheel load";
  input Units.Force K "Creep force per creepage at zero slip, see kalkerStiffness";
  input Units.FrictionCoefficient mu0 "Friction at zero slip velocity";
  input PolachParameters polach;
  input Units.Velocity v0 = 0.1 "Rolling velocity below which creepage is smoothed";
  output Units.Force F "Creep force, with the sign of w";
protected
  constant Real pi = 3.141592653589793;
  Units.FrictionCoefficient mu;
  Units.Velocity vRef "Rolling velocity, never zero";
  Real epsilon(unit="1") "Gradient of tangential stress in the area of adhesion, with sign";
algorithm
  mu := frictionCoefficient(w, mu0, polach);
  vRef := sqrt(v^2 + v0^2);
  epsilon := pi*K*w/(4.0*Q*mu*vRef);
  F := 2.0*Q*mu/pi*(polach.kA*epsilon/(1.0 + (polach.kA*epsilon)^2) + atan(polach.kS*epsilon));
  annotation (Documentation(info="<html>
<p><code>F = 2*Q*mu/pi*(kA*eps/(1 + (kA*eps)^2) + atan(kS*eps))</code>. The law is odd in
<code>epsilon</code>, so the sign of the slip needs no case distinction and the force is smooth
through zero slip.</p>
<h4>Limits</h4>
<p>The slope at zero slip is <code>K*(kA + kS)/2</code> per creepage; the force is bounded by
<code>mu*Q</code>. Below <code>v0</code> the contact creeps: it does not stick at standstill.</p>
<h4>References</h4>
<p>O. Polach (2000), <em>A fast wheel-rail forces calculation computer code</em>, Vehicle System
Dynamics 33, 728-739; O. Polach (2005), Wear 258, 992-1000.</p>
</html>"));
end creepForce;
