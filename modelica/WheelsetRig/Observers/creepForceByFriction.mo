within WheelsetRig.Observers;
function creepForceByFriction "Partial derivative of Contact.creepForce with respect to mu0"
  input Units.Velocity w "Slip velocity, positive in braking";
  input Units.Velocity v "Rolling velocity";
  input Units.Force Q "Wheel load";
  input Units.Force K "Creep force per creepage at zero slip";
  input Units.FrictionCoefficient mu0 "Friction at zero slip velocity";
  input Contact.PolachParameters polach;
  input Units.Velocity v0 = 0.1 "Rolling velocity below which creepage is smoothed";
  output Units.Force dF "Change of the force of one wheel per unit of mu0";
protected
  constant Real pi = 3.141592653589793;
  Units.FrictionCoefficient mu;
  Real epsilon(unit="1");
  Real a(unit="1");
  Real s(unit="1");
algorithm
  mu := Contact.frictionCoefficient(w, mu0, polach);
  epsilon := pi*K*w/(4.0*Q*mu*sqrt(v^2 + v0^2));
  a := polach.kA*epsilon;
  s := polach.kS*epsilon;
  dF := 2.0*Q*mu/(pi*mu0)*(2.0*a*(a/(1.0 + a^2))^2 + atan(s) - s/(1.0 + s^2));
  annotation (Documentation(info="<html>
<p>With <code>F = 2*Q*mu/pi*g(epsilon)</code>, <code>mu</code> proportional to <code>mu0</code> and
<code>epsilon</code> to its inverse, <code>dF/dmu0 = 2*Q*mu/(pi*mu0)*(g - epsilon*g')</code>.</p>
</html>"));
end creepForceByFriction;
