within Effects;
package Signals "What changes a value on its way: sensors, actuators, quantities"
  annotation (Documentation(info="<html>
<p>From <code>u</code> to <code>y</code>, in one unit, which a modifier gives to the size:
<code>Offset(offset(unit=&quot;V&quot;))</code>.</p>
</html>"));
end Signals;
