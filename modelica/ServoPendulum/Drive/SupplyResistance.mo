within ServoPendulum.Drive;
model SupplyResistance "A supply whose voltage falls with the current drawn from it"
  extends PartialResistance;
  parameter Real RS(unit="Ohm", min=0.0, max=10.0) = 0.0
    "Resistance between the source and the bridge";
equation
  y = u + RS*duty^2;
  annotation (
    __Workbench(effect(
      size="RS", matters=0.05,
      separation="the voltage at the servo with the shaft blocked, over the duty")),
    Documentation(info="<html>
<p>A bridge that is on for the share <code>duty</code> of the time draws <code>duty*i</code> from its
supply; of the voltage that this costs there, the winding sees the share <code>duty</code> again:
<code>y = u + RS*duty^2</code>. Cable, plug and source have 0.1 to 2 Ohm; what a voltmeter behind them
shows of it is in <code>volts</code> already.</p>
<h4>References</h4>
<p>R. W. Erickson, D. Maksimovic (2020), <em>Fundamentals of Power Electronics</em>, 3rd ed., ch. 3:
the averaged converter is a transformer of ratio <code>duty</code>.</p>
</html>"));
end SupplyResistance;
