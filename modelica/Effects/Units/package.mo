within Effects;
package Units "Types with SI units"
  type Velocity = Real(quantity="Velocity", unit="m/s");
  type Force = Real(quantity="Force", unit="N");
  type Pressure = Real(quantity="Pressure", unit="Pa", displayUnit="bar");
  type Temperature = Real(quantity="ThermodynamicTemperature", unit="K", min=0);
  type MassFlowRate = Real(quantity="MassFlowRate", unit="kg/s");
  type Time = Real(quantity="Time", unit="s");
  type Speed = Real "Velocity in m/s, or angular velocity in rad/s";
  type Load = Real "What friction grows with: force in N, torque in N.m, or pressure in Pa";
  type Resistance = Real "Force in N, or torque in N.m";
  annotation (Documentation(info="<html>
<p>The library stands on its own: these types replace <code>Modelica.Units.SI</code>. The last three
have no unit, since one interface serves straight and turning motion; their names tell them
apart.</p>
</html>"));
end Units;
