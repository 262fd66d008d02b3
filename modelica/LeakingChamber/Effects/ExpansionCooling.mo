within LeakingChamber.Effects;
model ExpansionCooling "air that cools as it expands, until the walls warm it up again"
  extends Interfaces.PartialHeat;
  parameter Real share(unit="1", min=0.0, max=1.5) = 0.0
    "Of what thermodynamics says; 1 where all air takes part";
  parameter Real tau(unit="s", min=0.1, max=100.0) = 5.0
    "Time in which the walls warm up the air at the pressure of filling";
  parameter Real pFilled(unit="Pa", min=1.0) = 8e5 "Pressure of filling, absolute";
  constant Real kappa(unit="1") = 1.4 "Ratio of the heat capacities of air";
  Real theta(unit="1", start=1.0, fixed=true) "Temperature of the air over that of the walls";
protected
  Real warming(unit="Pa/s") "Rise of pressure by heat from the walls";
equation
  warming = pFilled/tau*(1.0 - theta);
  pAir*der(theta) = theta*(warming - (kappa - 1.0)*theta*escape*pAir);
  rate = share*(warming - (kappa*theta - 1.0)*escape*pAir);
  annotation (
    __Workbench(effect(
      size="share", matters=0.1, shapes(tau={1.0, 3.0, 10.0, 30.0}),
      separation="a wall filled with steel wool, which keeps the temperature")),
    Documentation(info="<html>
<p>Energy of the air that stays, <code>m*cv*der(T) = H*(TWall - T) - R*T*q</code>: it does the work of
what leaves. Without heat from the walls the pressure falls <code>kappa</code> times as fast as at
constant temperature; later both come back to each other. <code>tau = m*cv/H</code> at the pressure of
filling.</p>
<h4>References</h4>
<p>P. Beater (2007), <em>Pneumatic Drives</em>, Springer, section 4: emptying of a chamber with heat
exchange.</p>
</html>"));
end ExpansionCooling;
