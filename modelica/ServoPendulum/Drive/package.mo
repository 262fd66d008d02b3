within ServoPendulum;
package Drive "What the motor, its bridge, its supply and its controller do beside the nominal"
end Drive;
