within HeatedHouse;
model House "One store of heat, that of the air"
  parameter Real C(unit="J/K", min=1e5) = 7.5e6 "Heat capacity of air and what is as warm";
  parameter Real G(unit="W/K", min=1.0) = 190.0 "Conductance from the air to the outside";
  parameter Real A(unit="m2", min=0.0) = 8.0 "Area of windows that would let all sun in";
  parameter Real Q(unit="W") = 0.0 "Heat that observers follow";

  input Real Ta(unit="K") "Temperature outside";
  input Real sun(unit="W/m2") "Irradiance";
  input Real heating(unit="W") "Power of the heaters";
  input Real dQ(unit="W") "Correction of Q";

  output Real T(unit="K", start=293.0, fixed=true, nominal=290.0) "Temperature of the air";
  output Real reading(unit="K") = sensor.y "Of that temperature";

  replaceable Interfaces.PromptHeater heater(power=heating, T=T)
    constrainedby Interfaces.PartialHeater(power=heating, T=T) "Electric heaters";
  replaceable Interfaces.LightShell shell(nominal=G*(T - Ta), T=T, G=G)
    constrainedby Interfaces.PartialShell(nominal=G*(T - Ta), T=T, G=G) "Walls, floor, roof";
  replaceable Common.Signals.Unchanged window(u=A*sun)
    constrainedby Common.Interfaces.Signal(u=A*sun) "From the sun to the heat of the air";
  replaceable Common.Signals.Unchanged sensor(u=T)
    constrainedby Common.Interfaces.Signal(u=T) "From the air to what is read";
equation
  C*der(T) = heater.heat + window.y - shell.actual + Q + dQ;
  annotation (
    experiment(StopTime=500000.0, Tolerance=1e-8),
    Documentation(info="<html>
<p><code>C*T' = heating + A*sun - G*(T - Ta)</code>: the model that Bacher and Madsen begin with. All three
parameters belong to the individual house.</p>
</html>"));
end House;
