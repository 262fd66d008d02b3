within LeakingChamber;
model Chamber "A tight chamber of air at constant temperature"
  parameter Real V(unit="m3", min=1e-6) = 1e-4 "Volume";
  parameter Real T(unit="K", min=1.0) = 293.15 "Temperature of the room";
  parameter Real pAmbient(unit="Pa", min=1.0) = 1.013e5 "Pressure of the room, absolute";
  parameter Real conductance(unit="kg/(s.Pa)", min=0.0) = 0.0 "Of a laminar leak";
  constant Real R(unit="J/(kg.K)") = 287.05 "Gas constant of air";

  input Real dconductance(unit="kg/(s.Pa)") "Correction of conductance";

  output Real p(unit="Pa", start=7e5, fixed=true, nominal=1e5) "Pressure above that of the room";
  output Real pReading(unit="Pa") = gauge.y "Reading of the pressure sensor";
  output Real q(unit="kg/s") = (conductance + dconductance)*p + leak.q "What leaves";

  replaceable Common.Leaks.Tight leak(p1=pAir, p2=pAmbient)
    constrainedby Common.Interfaces.Flow(p1=pAir, p2=pAmbient) "Leak to the room";
  replaceable Interfaces.Isothermal heat(pAir=pAir, escape=escape)
    constrainedby Interfaces.PartialHeat(pAir=pAir, escape=escape) "Heat of the air";
  replaceable Common.Signals.Unchanged gauge(u=p)
    constrainedby Common.Interfaces.Signal(u=p) "Pressure sensor";
protected
  Real pAir(unit="Pa") "Pressure in the chamber, absolute";
  Real escape(unit="1/s") "Share of the air that leaves within a second, at room temperature";
equation
  pAir = noEvent(max(1.0, p + pAmbient));  // a draw may ask for more than there is
  escape = q*R*T/(V*pAir);
  der(p) = heat.rate - escape*pAir;
  annotation (
    experiment(StopTime=100.0, Tolerance=1e-8),
    Documentation(info="<html>
<p>The mass of an ideal gas in a rigid chamber, <code>V*der(p) = -R*T*q</code>. Nothing leaves in the
nominal model, and the pressure stays as it is.</p>
<h4>Volume</h4>
<p>Pressure alone shows flow per volume: flows are for <code>V</code>, and in proportion to it.</p>
<h4>Slots</h4>
<p>What several leaks let through adds up, as does what heat makes of the pressure. Signals form a
chain.</p>
</html>"));
end Chamber;
